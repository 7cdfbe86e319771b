"""The verdict, and its report for people."""
