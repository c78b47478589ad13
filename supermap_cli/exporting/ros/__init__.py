"""The map as ROS 2 messages in an `.mcap`, for RViz, Foxglove and everything that plays a bag."""
