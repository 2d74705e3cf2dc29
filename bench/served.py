"""A program that renders on request in a process of its own, and stands still while others render."""
import ctypes
import json
import re
import signal
import subprocess
import threading

PR_SET_PDEATHSIG = 1


def die_with_parent():
    """Asks the system to end this process with the one that started it: a stopped one would never end by itself."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


class Served:
    """A process that answers every line of its standard input with a line of JSON: `error`, or what is asked."""

    def __init__(self, command, log, patience):
        self.log, self.patience = log, patience
        with open(log, "w", encoding="utf-8") as errors:
            try:
                self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors,
                                                text=True, preexec_fn=die_with_parent)
            except OSError as error:
                raise RuntimeError(f"{command[0]}: {error.strerror}") from error

    def last_words(self):
        """The last error that the program wrote to its standard error, or the last line."""
        with open(self.log, encoding="utf-8", errors="replace") as file:
            lines = [re.sub(r"\x1b\[[0-9;]*m", "", line).strip() for line in file]
        lines = [line for line in reversed(lines) if line] or [f"ended with {self.process.wait()}"]
        return next((line for line in lines if "error" in line.lower()), lines[0])

    def answer(self, request=None):
        """The answer to a line, or the first one; an error, an end and too long a wait are exceptions.

        Between answers the process is stopped: what it would do meanwhile others would pay for.
        """
        late = threading.Event()
        timer = threading.Timer(self.patience, lambda: (late.set(), self.process.kill()))
        timer.start()
        try:
            self.process.send_signal(signal.SIGCONT)
            if request is not None:
                self.process.stdin.write(f"{request}\n")
                self.process.stdin.flush()
            line = self.process.stdout.readline()
        except OSError:
            line = ""
        finally:
            timer.cancel()
        if late.is_set():
            raise RuntimeError(f"took longer than {self.patience:g} s")
        if not line:
            raise RuntimeError(self.last_words())
        self.process.send_signal(signal.SIGSTOP)
        found = json.loads(line)
        if "error" in found:
            raise RuntimeError(found["error"])
        return found

    def end(self):
        """Ends the process: it has nothing to save, and a stopped one does not listen."""
        self.process.kill()
        self.process.wait()
        self.process.stdin.close()
        self.process.stdout.close()
