"""The verdict, and its report as a page."""
