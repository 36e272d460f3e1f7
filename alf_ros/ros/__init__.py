"""All that imports rclpy, messages or mcap. No physics."""
