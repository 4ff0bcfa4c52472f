"""The global picture: where motions from all initial states end, and sections of motions."""
