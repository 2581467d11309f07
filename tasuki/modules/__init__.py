"""Modules: the algorithms, written in the Tasuki language. One small function each, under the paper's numbers where it
has one.
"""
