"""The pages in the browser: what they show, and the server that sends it."""
