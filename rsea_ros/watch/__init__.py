"""The live view: one page of plots and buttons, served by tornado. Knows no ROS; nodes/watch.py feeds it."""
