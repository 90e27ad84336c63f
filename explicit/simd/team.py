"""Threads of a CPU that share one simulation: their parts, their synchronisation, and changes of the team.

Every thread runs the whole time loop on separate packs, which are contiguous in the mesh. The thread in the
first seat also does the control work: totals, records, the next step and the boundary. It begins without the
other threads and has the last elements. The others join when they have a core. They leave temporarily if they
delay the team. No thread waits for a thread that has not joined. Sums over elements are computed in the order
of one thread. The result is therefore bitwise independent of the number of threads.
"""

import ctypes
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import cache
from typing import Any

import warp as wp

from explicit.arguments import SPARE
from explicit.layout.structs import Share, Total

MOST_SEATS = 8
"""Largest number of threads that share a simulation. There is memory for the largest values of
`lanes.WARPS`."""
LINE = 32
"""Distance between words: two cache lines, which a processor fetches in pairs."""
MET, LATE, STATE, RANK, ALL, FINISHED, WORDS = (row * MOST_SEATS * LINE for row in range(7))
"""Positions of words. By a thread's rank in the team: number of its synchronisations, and whether it was
late. By its seat: rank and state, which is away (0), ready (1), chosen (2) or in the team (3). For all
threads: size of the team, and whether a thread must leave. For a joining thread: the step, the steps until
the bound is measured, and the number of synchronisations. The last word marks the end of the simulation."""
SIZE, STEP, UNTIL, COUNT, LEAVING = (ALL + k for k in range(5))
PATIENCE, READY = 1000, 5000
"""Number of polls of another thread's word until that thread is late, and number of polls until a waiting
thread releases its core. A poll takes 10 to 40 ns."""
PATIENCE_EACH, READY_EACH = 1, 4
"""Additional polls for each element of the mesh. An element takes about as long as a poll. A thread is
therefore late if it needs longer than a single thread would. A waiting thread waits some steps for a call."""
MOST_LOOKS = 1 << 22
"""Largest number of polls, about 50 ms."""
NAP, LONGEST_NAP, PIECE, WAIT = 5000, 160000, 500, 20
"""First and largest time of a thread's absence, and time between two checks of a late thread [us]. An absent
thread occasionally checks for the end of the simulation."""
UNIT = 1000 if sys.platform == "win32" else 1
"""Unit of the system's sleep times [us]."""
PAYS = 1000
"""After this number of synchronisations in the team, a thread's next absence is short again."""


@wp.struct
class Team:
    """Shared data of the threads of one simulation, and the seat of this one."""

    seat: int
    """0 for the thread that does the control work."""
    seats: int
    """Number of seats."""
    room: int
    """Size of each sum in `shares` [numbers]."""
    patience: int
    """Polls of another thread's word after which that thread is late."""
    ready: int
    """Polls of a waiting thread after which it releases its core."""
    nap: wp.uint64
    """Address of a function that yields the core to other threads for a time [us]."""
    words: wp.array(dtype=wp.int32)  # type: ignore[valid-type]
    """Signals between the threads."""
    shares: wp.array(dtype=wp.float64)  # type: ignore[valid-type]
    """For each sum of `Share`: the shares of the elements and a pack of the first thread's sum. Then, by
    rank, the largest value that a thread has latched."""


TEAM_CODE = f"""
    const int seat = team.seat, seats = team.seats, keeps_books = seat == 0;
    int* const words = team.words.data;
    double* const shares = team.shares.data;
    const int shares_s0 = team.room;
    double* const latched_of = shares + {int(Share.COUNT)} * shares_s0;
    typedef void (*naps)(unsigned);
    const naps nap = (naps)team.nap;
    const i32v lane_of_all = lane_numbers + (keeps_books ? 0 : 0x40000000);
    int member = 0, members = 1, meetings = 0, nap_next = {NAP}, came = 0;
    struct team_op {{
        static inline int get(const int* word) {{ return __atomic_load_n(word, __ATOMIC_ACQUIRE); }}
        static inline void set(int* word, int value) {{ __atomic_store_n(word, value, __ATOMIC_RELEASE); }}
        static inline bool change(int* word, int from, int to) {{
            return __atomic_compare_exchange_n(word, &from, to, false, __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE);
        }}
        static inline void away(const int* words, int time, naps nap) {{
            for (; time > 0 && !get(words + {FINISHED}); time -= {PIECE}) nap({-(-PIECE // UNIT)});
        }}
        static inline void look() {{
#if defined(__x86_64__)
            __builtin_ia32_pause();
#endif
        }}
        // Every thread tells the others that it has come, and waits for them.
        static inline void meet(int* words, int member, int members, int now, int patience, naps nap) {{
            set(words + {MET} + member * {LINE}, now);
            for (int other = 0; other < members; ++other) {{
                int looks = 0;
                while (get(words + {MET} + other * {LINE}) < now) {{
                    if (++looks < patience) {{
                        look();
                    }} else {{
                        set(words + {LATE} + other * {LINE}, 1);
                        nap({-(-WAIT // UNIT)});
                    }}
                }}
            }}
        }}
        // Choose who goes on: those of the team who were not late, then those who are ready. Where the one
        // that chooses was late itself, there may be more threads than cores: the last one before it goes.
        static inline void choose(int* words, int seats, int members) {{
            int size = 0;
            int* const own = words + {LATE} + (members - 1) * {LINE};
            if (members > 1 && get(own)) set(own - {LINE}, 1);
            set(own, 0);
            words[{LEAVING}] = 0;
            for (int seat = 1; seat < seats; ++seat) {{
                int* const state = words + {STATE} + seat * {LINE};
                int* const rank = words + {RANK} + seat * {LINE};
                const int now = get(state);
                if (now == 3 && get(words + {LATE} + *rank * {LINE})) {{
                    set(words + {LATE} + *rank * {LINE}, 0);
                    *rank = -1;
                    set(state, 0);
                    words[{LEAVING}] = 1;
                }} else if (now == 3 || (now == 1 && change(state, 1, 2))) {{
                    *rank = size++;
                }}
            }}
            words[{SIZE}] = size + 1;
        }}
        // Let those begin who were chosen.
        static inline void call(int* words, int seats, int step, int until, int meetings) {{
            words[{STEP}] = step;
            words[{UNTIL}] = until;
            words[{COUNT}] = meetings;
            for (int seat = 1; seat < seats; ++seat) {{
                int* const state = words + {STATE} + seat * {LINE};
                if (get(state) == 2) set(state, 3);
            }}
        }}
        // Wait to be called; false where the simulation is at its end.
        static inline bool called(int* words, int seat, int time, int looks, naps nap) {{
            int* const state = words + {STATE} + seat * {LINE};
            while (!get(words + {FINISHED})) {{
                set(state, 1);
                for (int k = 0; k < looks && get(state) != 3 && !get(words + {FINISHED}); ++k) look();
                if (!change(state, 1, 0)) {{
                    while (get(state) != 3 && !get(words + {FINISHED})) look();
                    return get(state) == 3;
                }}
                away(words, time, nap);
            }}
            return false;
        }}
        // The first of n elements or nodes that a thread has: whole packs.
        static inline int begin(int n, int member, int members) {{
            return (int)((long long)((n + W - 1) / W) * member / members) * W;
        }}
        static inline int end(int n, int member, int members) {{
            const int next = begin(n, member + 1, members);
            return next < n ? next : n;
        }}
    }};
"""
"""C++ code at the beginning of a time loop whose lanes share a simulation."""
MEET = "if (members > 1) team_op::meet(words, member, members, ++meetings, team.patience, nap);"
"""C++ code of a synchronisation."""
SETTLE = """
    if (keeps_books && seats > 1) team_op::choose(words, seats, members);
    if (!keeps_books) latched_of[member * 16] = op::most(LATCHED);
"""
"""C++ code before the synchronisation at the end of a step."""
INHERIT = """
    for (int rank = 0; rank < members - 1; ++rank) { // what those that leave have latched
        const f64v other = (f64v)(latched_of[rank * 16]);
        LATCHED = other > LATCHED ? other : LATCHED;
    }
""".strip()
REGROUP = f"""
    if (keeps_books && seats > 1) {{
        if (words[{LEAVING}]) {{
            {INHERIT}
        }}
        team_op::call(words, seats, STEP, UNTIL, meetings);
        members = words[{SIZE}];
        member = members - 1;
    }} else if (!keeps_books) {{
        if (members > 1 && words[{RANK} + seat * {LINE}] < 0) {{
            nap_next = meetings - came > {PAYS} ? {NAP} : nap_next < {LONGEST_NAP} ? 2 * nap_next : nap_next;
            team_op::away(words, nap_next, nap);
            members = 1;
        }}
        if (members == 1) {{
            if (!team_op::called(words, seat, nap_next, team.ready, nap)) return;
            STEP = words[{STEP}];
            UNTIL = words[{UNTIL}];
            came = meetings = words[{COUNT}];
            LATCHED = (f64v)(0.0);
        }}
        members = words[{SIZE}];
        member = words[{RANK} + seat * {LINE}];
    }}
"""
"""C++ code at the beginning of a step, where threads join and leave."""
DISBAND = f"""
    if (!keeps_books) return;
    {INHERIT}
    if (seats > 1) team_op::set(words + {FINISHED}, 1);
    members = 1;
    member = 0;
"""
"""C++ code at the end of the loop: one thread completes the work."""
TOTALS = int(Total.COUNT)
"""Distance between the values that successive threads pass."""


class Seats:
    """Seats at a simulation of this many elements on a device."""

    def __init__(self, n_elements: int, seats: int, where: Any) -> None:
        self.seats, self.room = seats, n_elements + 2 * SPARE
        self.patience = min(PATIENCE + PATIENCE_EACH * n_elements, MOST_LOOKS)
        self.ready = min(READY + READY_EACH * n_elements, MOST_LOOKS)
        self.nap = nap_function()
        self.words: Any = wp.zeros(WORDS, dtype=wp.int32, device=where)
        self.words.numpy()[SIZE] = 1
        size = int(Share.COUNT) * self.room + 16 * seats
        self.shares: Any = wp.empty(size, dtype=wp.float64, device=where)

    def team(self, seat: int) -> Any:
        """The argument of the thread in a seat."""
        team = Team()
        team.seat = seat
        for name in ("seats", "room", "patience", "ready", "nap", "words", "shares"):
            setattr(team, name, getattr(self, name))
        return team

    def close(self) -> None:
        """End the threads that wait for a call."""
        self.words.numpy()[FINISHED] = 1


@cache
def single_thread_team() -> Any:
    """The argument of a thread that does not share its simulation."""
    team = Team()
    team.seats = 1
    return team


@cache
def nap_function() -> int:
    """Address of the system's function that yields the core to other threads."""
    if sys.platform == "win32":  # milliseconds there: longer sleeps
        function = ctypes.WinDLL("kernel32").Sleep
    else:
        function = ctypes.CDLL(None).usleep
    address = ctypes.cast(function, ctypes.c_void_p).value
    assert address is not None
    return address


ELEMENTS_EACH = 768
"""Smallest number of elements of a thread. With fewer elements, synchronisation is too frequent."""


class SharedRun:
    """One launch: a simulation or a pack of simulations.

    ``begin``: called when the launch begins. It returns a function that is called with the argument of each
    thread. ``count``: simulations of the launch. ``n_elements``: elements of a simulation that several
    threads can share, 0 for others. ``where``: the Warp device.
    """

    def __init__(
        self, begin: Callable[[], Callable[[Any], None]], count: int, n_elements: int, where: Any
    ) -> None:
        self.count = count
        self._begin, self._n_elements, self._where = begin, n_elements, where
        self._seats = 1
        self._begun: Future[tuple[Callable[[Any], None], Seats] | None] = Future()

    def offer(self, threads: int) -> Sequence[Callable[[], None]]:
        """Allow a number of threads to share the launch. Returns the functions of the joining threads. They
        may be called before or after the launch begins."""
        self._seats = max(1, min(threads, self._n_elements // ELEMENTS_EACH, MOST_SEATS))
        return [lambda seat=seat: self._join(seat) for seat in range(1, self._seats)]  # type: ignore[misc]

    def run(self) -> int:
        """Run the whole launch. Returns its number of simulations."""
        try:
            launch = self._begin()
            if self._seats == 1:
                launch(single_thread_team())
                return self.count
            seats = Seats(self._n_elements, self._seats, self._where)
            try:
                self._begun.set_result((launch, seats))
                launch(seats.team(0))
            finally:
                seats.close()
        finally:
            if not self._begun.done():  # joining threads need not wait
                self._begun.set_result(None)
        return self.count

    def _join(self, seat: int) -> None:
        admission = self._begun.result()
        if admission is not None:
            launch, seats = admission
            launch(seats.team(seat))
