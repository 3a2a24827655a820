"""Laws with corners: where they change, and their branches as parameters that events set."""
