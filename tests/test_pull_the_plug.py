"""scripts.pull_the_plug: what happened is counted."""

from scripts.disturbing import Disturbance
from scripts.pull_the_plug import page


def test_the_page_counts_what_happened():
    met = [
        Disturbance("train ppo", "kill", 0.5),
        Disturbance("train ppo", "EIO", 0.0),
        Disturbance("sweep", "kill", 2.0),
    ]
    text = page(met, ["train ppo: best"], 2, "python -m scripts.pull_the_plug")
    assert "2 times by SIGKILL and 1 times by a write that failed" in text
    assert "undisturbed run: 1." in text
    assert "| train ppo | 1 | 0 | 1 | 0.5 |" in text
