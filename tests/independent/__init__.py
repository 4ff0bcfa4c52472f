"""One independent program for every model; nothing of it imports the library."""
