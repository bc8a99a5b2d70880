from dataclasses import replace

from results import result, with_reference_kind

from attest.recording import Note
from attest.writers.summary_text import escape, markdown


def test_summary_tells_scores_reference_and_doubts_first():
    made = result(300)
    text = markdown(made)
    assert f"| total | {made.metrics.total.rmse:.2f} |" in text
    assert "Against **SIMSTATE** (truth)" in text
    assert text.index("**Warning:** 1 × gap over 1 s") < text.index("12 × frames with a bad CRC")


def test_autopilot_is_not_called_truth():
    text = markdown(with_reference_kind(result(20), "autopilot"))
    assert "not independent, not truth" in text


def test_without_reference_the_summary_says_so():
    assert "No reference" in markdown(result(20, reference=False))


def test_error_that_never_settles_is_told():
    made = result(20)
    metrics = replace(made.metrics, settling_time_s=None, after_settling=None)
    text = markdown(replace(made, metrics=metrics))
    assert "never stays below 3°" in text
    assert "after settling" not in text


def test_text_of_the_log_cannot_become_markdown():
    hostile = "a | b\n# c ![x](http://y) <script> `d` **e**"
    made = result(20)
    made = replace(
        made,
        metrics=replace(made.metrics, reference=hostile),
        notes=(Note(hostile),),
        recording=replace(made.recording, vehicle=hostile),
    )
    assert escape(hostile) == (r"a \| b \# c \!\[x\]\(http://y\) \<script\> \`d\` \*\*e\*\*")
    assert hostile not in markdown(made)
    assert markdown(made).count("\n#") == 1  # of our own heading of the notes
