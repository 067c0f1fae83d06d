"""Skin to cut: made by formulas, cropped from a real body, or from a file of one's own."""
