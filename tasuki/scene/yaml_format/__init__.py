"""Tasuki's own scene format, in YAML: `read` with places in every message, and `dump_yaml`.

`docs/scene-format.md` describes it, `tasuki.scene.schema` defines it. Text becomes YAML nodes that know their places
(`nodes`), these are checked and become the scene's tree (`tree`, `reader`); `places` turns what is wrong into messages.
"""

from tasuki.scene.yaml_format.reader import read
from tasuki.scene.yaml_format.writer import dump_yaml

__all__ = ["dump_yaml", "read"]
