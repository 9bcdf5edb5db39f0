"""The linear methods: integral least squares and what stands beside it."""
