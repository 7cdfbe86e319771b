"""The ankle joint as a list of physics terms, and its simulation. No ROS."""
