"""What a shot's data can tell about its parameters: profiles, verdicts, declared uncertainties, warnings."""
