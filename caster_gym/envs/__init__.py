"""What the environments of all tasks share: observations, starts, reports, and the engines that step them."""
