"""The uncertainty of a shot's parameters: noise, numerics, profiles, declared uncertainties, warnings."""
