"""The table of pooled shots states whether the interval of their mean contains the truth."""

from populations.pooled_shots import table


def test_the_mean_is_held_to_the_truth() -> None:
    shot = {"shot": "rate-01", "speed": 0.7, "value": 1.1267, "U": 0.0081, "counts": True}
    said = {"shots": [shot], "true": 1.12, "mean": 1.1232, "95 % interval": [1.1206, 1.1258]}
    assert "| 0.7 | 1.1267 | 0.0081 | yes |" in table({**said, "holds the truth": False})
    assert table({**said, "holds the truth": False}).endswith("95 % 1.1206 to 1.1258: does not hold 1.12")
    assert table({**said, "holds the truth": True}).endswith(": holds 1.12")
