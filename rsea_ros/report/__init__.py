"""From results to pages, tables and files: values go in, text comes out, for show only."""
