"""The contents of a log, gathered in one passage, and the page that shows them."""
