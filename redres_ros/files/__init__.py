"""Files and streams: text, YAML, what is installed with the package, plugins, signals."""
