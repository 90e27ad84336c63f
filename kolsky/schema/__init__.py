"""TOML schemas of a shot and of image correlation without a shot, in SI; errors name line and remedy."""
