"""Planning a test: what it would tell, where and when to look, how fast to strike."""
