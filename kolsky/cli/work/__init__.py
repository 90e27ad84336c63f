"""What a command does once its options are typed: load, call, write, print."""
