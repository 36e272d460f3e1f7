"""What a log shows, gathered in one passage through it, and the page that shows it."""
