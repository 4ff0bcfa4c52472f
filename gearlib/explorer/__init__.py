"""The explorer: a page with sliders for the keys of a configuration, and figures of its gears."""
