import json
import subprocess
import sys

SCRIPT = """
import sys
from brepgaussian.jobs import job
from brepgaussian.errors import InputError
with job("masks", sys.argv[1], 1, sys.argv[2], {{"seed": 4}}):
    {body}
"""


def run(tmp_path, body):
    log, failed = tmp_path / "masks.log", tmp_path / "masks.failed.json"
    code = SCRIPT.format(body=body)
    done = subprocess.run([sys.executable, "-c", code, str(log), str(failed)], check=False)
    return done.returncode, log.read_text(), failed


def test_a_fault_of_the_input_is_logged_and_recorded_without_a_traceback(tmp_path):
    status, log, failed = run(tmp_path, "raise InputError('is empty', file='a.png', fix='take another')")
    assert status == 1
    assert "a.png: is empty Fix: take another" in log
    assert "Traceback" not in log.split("Fix: take another")[0]
    assert json.loads(failed.read_text()) == {"stage": "masks", "reason": "masks: a.png: is empty Fix: take another"}


def test_a_crash_leaves_its_traceback_in_the_log(tmp_path):
    status, log, failed = run(tmp_path, "1 / 0")
    assert status == 1
    assert "ZeroDivisionError" in log
    assert "ZeroDivisionError" in failed.read_text()


def test_settings_open_the_log_and_success_clears_the_record(tmp_path):
    (tmp_path / "masks.failed.json").write_text("{}")
    status, log, failed = run(tmp_path, "print('working')")
    assert status == 0
    assert '{"seed": 4}' in log.splitlines()[1]
    assert "working" in log
    assert not failed.exists()
