"""The live view: one page of plots and buttons, served by tornado; node.py feeds it from ROS."""
