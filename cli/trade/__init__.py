"""The measured trade of speed for accuracy of one scene."""
