"""How fast Tasuki is, beside its peers in the same minute. Run as `python -m bench.NAME` from the repository's root."""
