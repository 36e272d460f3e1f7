"""From text to a Scene: every typing error ends here, with its line."""
