"""The whole test from the striker on: what a planned test of the flyer will do, before it is done."""
