"""The tests of the modules compile into a cache folder of their own."""

import pytest


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TASUKI_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield
