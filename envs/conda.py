"""Renew the packages of `environment.yaml` from `requirements.txt`.

They are listed there and not read from there: Snakemake copies the file elsewhere before conda reads it, so a
relative `-r requirements.txt` would not be found, and would not count in the environment's hash either.
"""

from pathlib import Path

HERE = Path(__file__).resolve().parent
PIP = "  - pip:\n"


def environment() -> str:
    """The text of `environment.yaml` with the locked packages."""
    head = (HERE / "environment.yaml").read_text(encoding="utf-8").split(PIP)[0]
    lines = (HERE / "requirements.txt").read_text(encoding="utf-8").splitlines()
    pins = [line for line in lines if line and not line.startswith("#")]
    return head + PIP + "".join(f"      - {pin}\n" for pin in pins)


if __name__ == "__main__":
    (HERE / "environment.yaml").write_text(environment(), encoding="utf-8")
