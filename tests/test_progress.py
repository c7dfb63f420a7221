import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from distributed import Client, LocalCluster

from scenarios import __main__ as cli
from scenarios.experiment.progress import cluster, parallel
from twin import TwinError

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def address():
    with LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
    ) as workers:
        yield workers.scheduler_address


@pytest.fixture
def silent_address():
    """Of a port that is taken, but that nobody listens on."""
    with socket.socket() as port:
        port.bind(("127.0.0.1", 0))
        yield f"tcp://127.0.0.1:{port.getsockname()[1]}"


def test_work_is_done_by_the_cluster_in_order(address):
    with Client(address) as client:
        workers = set(client.run(os.getpid).values())
    with cluster(address):
        done = parallel(lambda i: (i, os.getpid()), range(20), 1, "numbers")
    assert [i for i, _ in done] == list(range(20))
    assert {pid for _, pid in done} <= workers
    assert len(workers) == 2


def test_after_the_cluster_work_is_done_here_again(address):
    with cluster(address):
        pass
    assert parallel(lambda _: os.getpid(), range(2), 1, "numbers") == [os.getpid()] * 2


def test_cluster_gives_the_rows_of_one_process_to_the_bit(address):
    def rows(*options):
        """Of a process of its own, which has nothing done before."""
        args = ["run", "mass", "--duration", "5", "--seeds", "2", "--json", "-", *options]
        run = subprocess.run(
            [sys.executable, "-m", "scenarios", *args], capture_output=True, cwd=ROOT
        )
        assert (run.returncode, run.stderr) == (0, b"")
        return json.loads(run.stdout)["rows"]

    assert rows("--dask", address) == rows()


def test_error_of_the_work_passes_through_the_cluster(address):
    def fail(_):
        raise ZeroDivisionError("of a worker")

    with pytest.raises(ZeroDivisionError, match="of a worker"), cluster(address):
        parallel(fail, range(2), 1, "numbers")


def test_address_that_does_not_answer_is_one_line(silent_address, monkeypatch, capsys):
    monkeypatch.setattr("scenarios.experiment.progress.TIMEOUT", 0.5)
    assert cli.main(["run", "mass", "--dask", silent_address]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"til: --dask: {silent_address} is no cluster that answers within 0.5 s")


@pytest.mark.parametrize("address", ["nowhere", "http://127.0.0.1:1", ""])
def test_address_that_is_none_is_refused(address):
    with (
        pytest.raises(TwinError, match="allowed: the address of a Dask scheduler"),
        cluster(address),
    ):
        pass


def test_scheduler_without_a_worker_is_refused(monkeypatch):
    monkeypatch.setattr("scenarios.experiment.progress.TIMEOUT", 0.5)
    with (
        LocalCluster(
            n_workers=0,
            processes=False,
            protocol="tcp",
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
        ) as empty,
        pytest.raises(TwinError, match=r"with a worker"),
        cluster(empty.scheduler_address),
    ):
        pass


def test_missing_extra_is_one_line_that_names_it(monkeypatch, capsys, tmp_path):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert cli.main(["reproduce", "til-table-3", "--out", str(tmp_path), "--dask", "tcp://h"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "pip install 'twin-in-the-loop[dask]'" in line
