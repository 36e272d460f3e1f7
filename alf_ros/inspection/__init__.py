"""Questions asked once of a mechanism or scene: is it sound, what do its effects cost."""
