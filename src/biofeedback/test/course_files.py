"""Files of conditioning courses."""

from importlib import resources

import yaml

COURSES_OF_THE_PACKAGE = ("down_training", "up_training")


def written(folder, **changes):
    """A short course."""
    source = resources.files("biofeedback") / "config" / "courses" / "down_training.yaml"
    content = yaml.safe_load(source.read_text())
    content |= {"blocks": 3, "trials_per_block": 25, "control_trials": 10}
    background = content["background"]
    background |= changes.pop("background", {})
    content |= changes
    path = folder / "course.yaml"
    path.write_text(yaml.safe_dump(content))
    return str(path)
