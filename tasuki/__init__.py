"""Tasuki: a laboratory for image generation."""

from tasuki.version import __version__

__all__ = ["__version__"]
