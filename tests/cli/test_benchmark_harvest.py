"""``punnet benchmark harvest``: tables, JSON, picture, and bad input."""

import json


def test_a_suite_is_harvested_and_kept(punnet, tmp_path, one_plant):
    folder = tmp_path / "run"
    command = ("benchmark", "harvest", "--suite", "night", "--clusters", 1, "--workers", 1, "--out", folder)
    result = punnet(*command)
    assert result.code == 0, result.err
    for words in (
        "suite night/1",
        "50.0%",
        "1 of 2",
        "grip: nothing between the pads",
        "3.0 mm",
        "missed.png",
    ):
        assert words in result.out
    figures = json.loads(punnet(*command, "--json").out)
    assert (figures["suite"], figures["suite_version"], figures["seed"]) == ("night", 1, 0)
    assert figures["success"]["hits"] == 1
    assert (figures["planner"], figures["planner_bundle"]) == ("fused", None)
    assert figures["missed"] == {"grip: nothing between the pads": 1}
    punnet(*command, "--choice", "mean").fails_with("begun with choice 'collision-aware'", "--force")


def test_bad_input_is_named(punnet, tmp_path, taken):
    punnet("benchmark", "harvest", "--suite", "hard").fails_with("no suite 'hard'", "easy")
    punnet("benchmark", "harvest", "--choice", "best").fails_with("no choice 'best'", "mean")
    punnet("benchmark", "harvest", "--planner", "rrt").fails_with("no planner 'rrt'", "deep-promp")
    nowhere = ("--planner", "fused", "--planner-bundle", "nowhere")
    punnet("benchmark", "harvest", *nowhere).fails_with("nowhere")
    punnet("harvest", *nowhere, "--out", tmp_path / "harvest").fails_with("nowhere")
    punnet("benchmark", "harvest", "--backend", "threads").fails_with("backend", "loky")
    punnet("benchmark", "harvest", "--out", taken).fails_with("is no harvest benchmark")
