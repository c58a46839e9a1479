"""What pykrot promises: the command line's results, its sentences, and arrays."""

import filecmp
import json
import gc
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pykrot
import pytest

KROT = os.environ["KROT_EXECUTABLE"]
SAMPLE = os.environ["KROT_SAMPLE"]
FILES = ("cameras.bin", "images.bin", "points3D.bin")


def krot(*arguments):
    return subprocess.run([KROT, *map(str, arguments)], capture_output=True,
                          text=True, check=False)


def run_krot(*arguments):
    run = krot(*arguments)
    assert run.returncode == 0, run.stderr
    return run


@pytest.fixture(scope="session")
def scene(tmp_path_factory):
    """20 frames, 0.5 px of noise, from a rough start."""
    path = tmp_path_factory.mktemp("scene") / "model"
    run_krot("model_synthesizer", "--output_path", path,
             "--Scene.pixel_noise", "0.5",
             "--Scene.start_translation_noise", "0.005",
             "--Scene.start_point_noise", "0.005")
    return path


def assert_same_files(folder1, folder2):
    for name in FILES:
        assert filecmp.cmp(folder1 / name, folder2 / name, shallow=False), name


@pytest.mark.parametrize("command, function, options, keywords", [
    ("solver", pykrot.solve, [], {}),
    ("solver", pykrot.solve, ["--Solver.finish", "none", "--Solver.norm", "1"],
     {"finish": "none", "norm": 1}),
    ("point_triangulator", pykrot.triangulate, [], {}),
    ("outlier_filter", pykrot.filter, ["--OutlierFilter.max_error", "1.2"],
     {"max_error": 1.2}),
    ("bundle_adjuster", pykrot.bundle_adjust,
     ["--BundleAdjustmentCeres.num_threads", "1"],
     {"options": {"BundleAdjustmentCeres.num_threads": 1}}),
])
def test_gives_the_bits_of_the_command(scene, tmp_path, command, function,
                                       options, keywords):
    run_krot(command, "--input_path", scene, "--output_path",
             tmp_path / "command", *options)
    result = function(pykrot.Model.read(scene), **keywords)
    result.model.write(tmp_path / "python")
    assert_same_files(tmp_path / "command", tmp_path / "python")


def test_tolerances_are_those_of_the_command(scene, tmp_path):
    run_krot("tolerance_analyzer", "--input_path", scene,
             "--ToleranceAnalyzer.max_error", "3", "--ToleranceAnalyzer.images",
             "2,3", "--ToleranceAnalyzer.points", "5", "--report_path",
             tmp_path / "r.json")
    result = pykrot.tolerances(pykrot.Model.read(scene), 3, images=[2, 3],
                               points=[5])
    expected = json.loads((tmp_path / "r.json").read_text())
    assert result.report["boxes"] == expected["boxes"]
    with pytest.raises(pykrot.NoSolutionError):
        pykrot.tolerances(pykrot.Model.read(scene), 0.01)


def test_keeps_cameras_within_a_radius_of_their_positions(scene, tmp_path):
    model = pykrot.Model.read(scene)
    radius = 2e-3
    off = np.random.default_rng(1).normal(size=model.centers.shape)
    places = model.centers + 1.5 * radius * off / np.linalg.norm(
        off, axis=1, keepdims=True)
    positions = tmp_path / "positions.txt"
    positions.write_text("".join(
        f"{name} {x!r} {y!r} {z!r} {radius}\n"
        for name, (x, y, z) in zip(model.image_names, places.tolist())))
    result = pykrot.solve(model, positions_path=str(positions))
    assert result.report["termination"] == "gap_reached"
    assert result.report["support_positions"]
    distances = np.linalg.norm(result.model.centers - places, axis=1)
    assert distances.max() <= (1 + 1e-6) * radius


def test_takes_positions_in_a_frame_of_their_own(scene, tmp_path):
    model = pykrot.Model.read(scene)
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    places = 3 * model.centers @ turn.T + [100, -50, 0]
    places[1] += [5, 0, 0]
    positions = tmp_path / "gps.txt"
    positions.write_text("".join(
        f"{name} {x!r} {y!r} {z!r} 0.1\n"
        for name, (x, y, z) in zip(model.image_names, places.tolist())))
    wrong = model.image_names[1]
    for function in (pykrot.solve, pykrot.bundle_adjust):
        with pytest.warns(UserWarning, match=f"the position of {wrong}"):
            result = function(model, positions_path=str(positions),
                              positions_frame="own", output_frame="own")
        frame = result.report["positions"]["frame"]
        assert [one["name"] for one in frame["wrong"]] == [wrong]
        assert frame["scale"] == pytest.approx(3, rel=0.05)
        distances = np.linalg.norm(result.model.centers - places, axis=1)
        assert np.delete(distances, 1).max() < 0.2
    for words in ({"output_frame": "own"}, {"positions_frame": "own"}):
        with pytest.raises(pykrot.OptionError):
            pykrot.solve(model, **words)


def test_adjusts_to_the_metres_of_scale_bars(scene, tmp_path):
    model = pykrot.bundle_adjust(pykrot.Model.read(scene)).model
    names = model.image_names
    lengths = np.linalg.norm(model.centers[0] - model.centers[2:5], axis=1)
    bars = tmp_path / "bars.txt"
    bars.write_text("".join(
        f"{names[0]} {name} {4 * length!r} {1e-3 * length!r}\n"
        for name, length in zip(names[2:5], lengths.tolist())))
    result = pykrot.bundle_adjust(model, distances_path=str(bars))
    assert all(one["takes_part"]
               for one in result.report["distances"]["distances"])
    assert np.linalg.norm(result.model.centers[0] - result.model.centers[2:5],
                          axis=1) == pytest.approx(4 * lengths, rel=1e-3)


def test_adjusts_around_what_is_fixed(scene, tmp_path):
    model = pykrot.Model.read(scene)
    held = tmp_path / "held.txt"
    held.write_text("".join(name + "\n" for name in model.image_names[:2]))
    result = pykrot.bundle_adjust(model, fixed_images_path=str(held))
    assert np.array_equal(result.model.centers[:2], model.centers[:2])
    assert not np.array_equal(result.model.centers[2:], model.centers[2:])


def test_the_sample_ends_where_the_command_ends(tmp_path):
    run_krot("solver", "--input_path", SAMPLE, "--output_path",
             tmp_path / "command", "--output_type", "BIN")
    pykrot.solve(pykrot.Model.read(SAMPLE)).model.write(tmp_path / "python")
    assert_same_files(tmp_path / "command", tmp_path / "python")


def random_problem(num_images=6, num_points=80, noise=0.3):
    """Pinholes around a cloud; returns the problem and its true centres."""
    rng = np.random.default_rng(7)
    points = rng.uniform(-1, 1, (num_points, 3))
    angles = np.linspace(0, 2, num_images)
    rotations = np.array([[[np.cos(a), 0, np.sin(a)], [0, 1, 0],
                           [-np.sin(a), 0, np.cos(a)]] for a in angles])
    translations = np.tile([0.0, 0.0, 5.0], (num_images, 1))
    rows = []
    for n in range(num_images):
        for k in range(num_points):
            x = rotations[n] @ points[k] + translations[n]
            pixel = 800 * x[:2] / x[2] + 500 + rng.uniform(-noise, noise, 2)
            rows.append((pixel, n, k))
    rng.shuffle(rows)
    problem = pykrot.Problem(
        np.array([row[0] for row in rows]), np.array([row[1] for row in rows]),
        np.array([row[2] for row in rows]), rotations,
        [("PINHOLE", 1000, 1000, [800, 800, 500, 500])])
    return problem, -np.einsum("nji,nj->ni", rotations, translations)


def test_arrays_have_a_certified_result_from_nothing_in_three_lines():
    problem, centers = random_problem()
    result = pykrot.solve(problem)
    assert result.lower_bound <= result.max_error < 0.3 * np.sqrt(2)
    assert pykrot.check_certificate(problem, result.certificate).is_accepted

    found = result.model.centers - result.model.centers.mean(axis=0)
    wanted = centers - centers.mean(axis=0)
    found *= np.linalg.norm(wanted) / np.linalg.norm(found)
    assert np.abs(found - wanted).max() < 0.01
    assert result.translations.shape == (6, 3)
    assert result.points.shape == (80, 3)


def test_errors_are_those_of_an_own_projection():
    problem, _ = random_problem()
    model = pykrot.solve(problem).model
    pixels, images, points = model.observations()
    x = np.einsum("nij,nj->ni", model.rotations[images],
                  model.points[points]) + model.translations[images]
    projected = 800 * x[:, :2] / x[:, 2:] + 500
    expected = np.linalg.norm(projected - pixels, axis=1)
    np.testing.assert_allclose(model.pixel_errors(), expected, atol=1e-9)


def test_noise_is_that_of_the_scene(scene):
    model = pykrot.solve(pykrot.Model.read(scene)).model
    noise = model.noise()
    assert 0.4 < noise["sigma_px"] < 0.8
    assert (noise["w"] > noise["critical_w"]).sum() == 0
    images = model.observations()[1]
    assert noise["w"].shape == images.shape
    assert noise["redundancy"].min() >= 0
    assert noise["redundancy"].max() <= 1
    alike = model.noise(relative_sigmas=np.full(images.shape, 2.0))
    np.testing.assert_allclose(2 * alike["sigma_px"], noise["sigma_px"])
    with pytest.raises(ValueError, match="false_alarm = 2"):
        model.noise(false_alarm=2)


def test_a_check_says_what_is_wrong_and_gives_the_model_without(scene):
    model = pykrot.solve(pykrot.Model.read(scene)).model
    sound = pykrot.check(model)
    assert sound.report["verdict"].startswith("Nothing is wrong")
    assert len(sound.report["images"]) == len(model.centers)


def test_a_check_asks_the_matches_of_a_database(tmp_path):
    run_krot("model_synthesizer", "--output_path", tmp_path / "scene",
             "--database_path", tmp_path / "database.db",
             "--Scene.num_frames", "8", "--Scene.pixel_noise", "0.5")
    model = pykrot.Model.read(tmp_path / "scene")
    report = pykrot.check(model, database=tmp_path / "database.db").report
    assert report["verdict"].startswith("Nothing is wrong")
    assert report["database"]["num_kept_pairs"] > 20
    assert report["database"]["num_contradictory_pairs"] == 0
    assert pykrot.check(model).report["database"] is None
    with pytest.raises(pykrot.ModelError, match="cannot be opened"):
        pykrot.check(model, database=tmp_path / "none.db")


def test_a_filter_without_a_bound_knows_the_noise(scene):
    model = pykrot.solve(pykrot.Model.read(scene)).model
    assert pykrot.filter(model).report["method"] == "snooping"


def test_a_certificate_of_another_model_is_refused(scene):
    problem, _ = random_problem()
    certificate = pykrot.solve(problem).certificate
    verdict = pykrot.check_certificate(pykrot.Model.read(scene), certificate)
    assert not verdict.is_accepted
    assert verdict.refusal


def test_conflicts_prove_how_many_must_go(scene):
    model = pykrot.Model.read(scene)
    result = pykrot.filter(model, 1.2)
    verdict = pykrot.check_certificate(model, result.certificate)
    assert verdict.is_accepted
    assert verdict.num_conflicts == result.report["num_must_go"]
    assert result.max_error <= 1.2


def test_points_are_a_view_that_outlives_its_model(scene):
    model = pykrot.Model.read(scene)
    points = model.points
    points[0] = [1, 2, 3]
    assert model.points[0].tolist() == [1, 2, 3]
    del model
    gc.collect()
    assert points[0].tolist() == [1, 2, 3]


def test_wrong_options_have_the_sentence_of_the_command(scene, tmp_path):
    run = krot("solver", "--input_path", scene, "--output_path", tmp_path / "o",
               "--Solver.relative_gap", "-1")
    with pytest.raises(pykrot.OptionError) as error:
        pykrot.solve(pykrot.Model.read(scene), relative_gap=-1)
    assert run.stderr.strip() == f"krot solver: --{error.value}"


@pytest.mark.parametrize("keywords, sentence", [
    ({"relative_gop": 1}, "did you mean --Solver.relative_gap?"),
    ({"max_iterations": 1}, "give the whole name"),
    ({"method": "joint", "settings": "paper"}, "has no effect"),
])
def test_refuses_options_that_mean_nothing(scene, keywords, sentence):
    with pytest.raises(pykrot.OptionError, match=sentence.replace("?", r"\?")):
        pykrot.solve(pykrot.Model.read(scene), **keywords)


@pytest.mark.parametrize("change, sentence", [
    ({"observations": np.zeros((3, 3))}, r"observations has the shape \(3, 3\)"),
    ({"point_indices": np.full(480, -1)}, r"point_indices\[0\] = -1"),
    ({"rotations": np.zeros((6, 3, 3))}, r"rotations\[0\] is no rotation"),
    ({"cameras": [("PINHOLY", 1, 1, [])]}, "PINHOLY is unknown"),
    ({"cameras": [("PINHOLE", 1, 1, [1])]}, "parameter"),
])
def test_refuses_arrays_that_do_not_fit(change, sentence):
    problem, _ = random_problem()
    for name, value in change.items():
        setattr(problem, name, value)
    with pytest.raises(ValueError, match=sentence):
        pykrot.solve(problem)


def test_a_missing_model_is_named(tmp_path):
    with pytest.raises(pykrot.ModelError, match=str(tmp_path)):
        pykrot.Model.read(tmp_path)


def test_says_that_nothing_is_below_an_impossible_bound():
    problem, _ = random_problem()
    with pytest.raises(pykrot.NoSolutionError, match="infeasible") as error:
        pykrot.solve(problem, init="feasible", init_max_error=0.01)
    assert error.value.report["lower_bound"] >= 0.01


def test_tells_of_its_progress(scene):
    seen = []
    pykrot.solve(pykrot.Model.read(scene),
                 progress=lambda *state: seen.append(state))
    assert {"joint", "finish"} <= {stage for stage, _, _ in seen}


def test_an_exception_of_the_callback_comes_out(scene):
    def fail(*_):
        raise RuntimeError("enough")
    with pytest.raises(RuntimeError, match="enough"):
        pykrot.solve(pykrot.Model.read(scene), progress=fail)


def test_ctrl_c_ends_a_solve(scene):
    def interrupt_soon(*_):
        # The solve waits here until the signal has been looked at.
        if not timer.is_alive() and not timer.finished.is_set():
            timer.start()
            timer.join()
            threading.Event().wait(0.3)
    timer = threading.Timer(
        0.01, lambda: signal.pthread_kill(threading.main_thread().ident,
                                          signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        pykrot.solve(pykrot.Model.read(scene), progress=interrupt_soon)


def test_compares_two_models(scene):
    model = pykrot.Model.read(scene)
    report = pykrot.compare(model, pykrot.solve(model).model)
    assert report["num_shared_poses"] == len(model.image_names)


class Reconstruction:
    """As much of pycolmap's as is needed."""
    def __init__(self, path=None):
        self.model = pykrot.Model.read(path) if path else None

    def read(self, path):
        self.model = pykrot.Model.read(path)

    def write(self, path):
        self.model.write(path, overwrite=True)


def test_goes_to_and_from_what_can_only_read_and_write_files(scene, tmp_path):
    model = pykrot.from_pycolmap(Reconstruction(scene))
    back = pykrot.to_pycolmap(model, Reconstruction())
    back.write(tmp_path / "back")
    model.write(tmp_path / "model")
    assert_same_files(tmp_path / "back", tmp_path / "model")


def test_takes_a_reconstruction_and_gives_one_back(scene, tmp_path):
    given = Reconstruction(scene)
    solved = pykrot.solve(given)
    solved.reconstruction.write(tmp_path / "back")
    pykrot.solve(pykrot.Model.read(scene)).model.write(tmp_path / "model")
    assert_same_files(tmp_path / "back", tmp_path / "model")
    given.write(tmp_path / "given")
    assert_same_files(tmp_path / "given", scene)
    assert isinstance(pykrot.check(given).reconstruction, Reconstruction)
    assert pykrot.compare(given, solved.reconstruction)["num_shared_poses"] > 0


def test_names_what_it_takes():
    with pytest.raises(TypeError, match="expected a pykrot.Model"):
        pykrot.solve("sparse/0")


EXAMPLES = Path(__file__).resolve().parents[2] / "tools" / "examples"


def run_example(name, *arguments):
    run = subprocess.run([sys.executable, str(EXAMPLES / name),
                          *map(str, arguments)],
                         capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return run.stdout


def test_the_examples_run(tmp_path):
    certificate = tmp_path / "certificate.json"
    by_command = tmp_path / "by_command"
    run_krot("solver", "--input_path", SAMPLE, "--output_path", by_command,
             "--certificate_path", certificate)

    assert "none below" in run_example("solve_folder.py", SAMPLE,
                                       tmp_path / "solved")
    assert_same_files(tmp_path / "solved", by_command)
    assert "none below" in run_example("arrays.py")
    assert "px" in run_example("triangulate_point.py")
    assert "proved" in run_example("check_certificate.py", SAMPLE, certificate)
    assert "ended early" in run_example("progress.py", SAMPLE)
    assert "noise of" in run_example("find_wrong.py", SAMPLE,
                                     tmp_path / "cured")
    assert (tmp_path / "cured" / "images.bin").exists()
