"""A design by the paper's method: page, tables, map, surface, design.json."""
