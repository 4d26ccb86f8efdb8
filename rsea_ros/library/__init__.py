"""The functions of `import rsea_ros`: check, identify, diagnose, simulate, read_bag.

Each name is imported on first use (rsea_ros/__init__.py). Nothing here needs ROS.
"""
