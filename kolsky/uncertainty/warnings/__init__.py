"""What a user must know before using an answer: one sentence each, with the value and what to do."""
