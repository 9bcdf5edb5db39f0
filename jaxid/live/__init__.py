"""A page in the browser that follows a folder of logs: findings, fit, gap and the missing effect, as they are found."""
