"""Figures by matplotlib, as drawings for the page."""
