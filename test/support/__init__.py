"""What several tests share: mechanisms, processes, readers, and where things lie."""
