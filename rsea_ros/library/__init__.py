"""What `import rsea_ros` offers: records from arrays, identification and diagnosis as plain calls.

Each name of the door is imported when it is first used (rsea_ros/__init__.py). Nothing here needs ROS.
"""
