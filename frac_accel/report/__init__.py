"""Reports as single HTML files: the page, its figures, and the pages of the commands."""

from .page import Page, Section, require_plotly

__all__ = ["Page", "Section", "require_plotly"]
