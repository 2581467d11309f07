from tasuki.language import dot, f32, module, vec3


@module
def 輝度(法線: vec3, 光: vec3) -> f32:
    """輝度を求める"""
    強さ = dot(法線, 光); 結果 = 強さ + 未定義
    return 結果 * (法線 + 1)
