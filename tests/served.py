"""Many uses of the program for the price of few starts: served.c, put before the MPI library, lets a program that has
loaded and started MPI fork for each command line. A use costs a tenth of the processor time of a start. Not tested so are
the loading, MPI_Init and MPI_Finalize; several ranks cannot be served."""
import atexit
import functools
import os
import resource
import shutil
import struct
import subprocess
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))


@functools.lru_cache(None)
def library():
    folder = tempfile.mkdtemp(prefix="stickslip-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    path = os.path.join(folder, "served.so")
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", path, os.path.join(HERE, "served.c"), "-ldl"], check=True)
    return path


class Server:
    """One program that waits; `cpu`, `wall`: seconds after which a use ends by SIGXCPU (0: never) and by SIGALRM; `memory`: bytes
    that it may have beyond those of the program that waits."""

    def __init__(self, program, cpu, wall, memory=None):
        self.program = program
        self.session = tempfile.mkdtemp(prefix="stickslip-")  # Open MPI's folder
        asked, self.requests = os.pipe()
        self.answers, told = os.pipe()
        settings = {"LD_PRELOAD": library(), "STICKSLIP_SERVED": f"{asked} {told} {cpu} {wall}",
                    "OMPI_MCA_orte_tmpdir_base": self.session,
                    "LD_BIND_NOW": "1",  # once for all
                    "ASAN_OPTIONS": "detect_leaks=0:verify_asan_link_order=0"}
        self.process = subprocess.Popen([program], pass_fds=(asked, told), env={**os.environ, **settings},
                                        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        os.close(asked)
        os.close(told)
        if memory:
            self.run(["--version"], self.session, "/dev/null", "/dev/null")  # by now it has what it has
            size = 300 << 20  # where the system does not tell
            if os.path.exists(f"/proc/{self.process.pid}/statm"):
                with open(f"/proc/{self.process.pid}/statm", encoding="ascii") as file:
                    size = int(file.read().split()[0]) * os.sysconf("SC_PAGESIZE")
            resource.prlimit(self.process.pid, resource.RLIMIT_AS, (size + memory, size + memory))

    def run(self, words, folder, out, err):
        """Exit code (negative: a signal) and seconds of processor time of the program with these words in `folder`;
        `out`, `err`: absolute names of files for what it prints."""
        texts = b"".join(os.fsencode(text) + b"\0" for text in [folder, out, err, self.program, *words])
        os.write(self.requests, struct.pack("I", len(texts)) + texts)
        answer = b""
        while len(answer) < 16:
            more = os.read(self.answers, 16 - len(answer))
            assert more, "the server has gone"
            answer += more
        status, seconds = struct.unpack("i4xd", answer)
        return os.waitstatus_to_exitcode(status), seconds

    def close(self):
        os.close(self.requests)
        os.close(self.answers)
        self.process.wait()
        shutil.rmtree(self.session, ignore_errors=True)
