"""Maps of the positions of a mechanism over one or two coordinates."""
