"""What packages outside of this one may import beside the door, `import rsea_ros` (docs/architecture.md)."""
