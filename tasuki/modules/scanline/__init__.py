"""The thirteen modules of the scanline method (paper, section 7, Figures 10 to 12), in the order of its flow."""
