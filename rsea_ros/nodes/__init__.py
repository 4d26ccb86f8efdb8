"""Nodes, thin: parameters to objects, callbacks of three lines, exceptions to diagnostics and a log line."""
