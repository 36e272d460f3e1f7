"""The node `close`: all joints of a mechanism with loops from its active ones."""
