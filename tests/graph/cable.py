"""A cable that is long and loses packets: run in a network namespace, between two of its devices, until it is ended.

    python -m tests.graph.cable DEVICE DEVICE DELAY LOSS

DELAY: of each packet (s). LOSS: share of packets that do not arrive, in a fixed order.
"""

from __future__ import annotations

import random
import select
import socket
import sys
import time
from collections import deque

# Of <linux/if_packet.h> and <linux/if_ether.h>: a packet comes with a header that says which checksums are left to the
# device, and is sent on with the same one.
SOL_PACKET, PACKET_VNET_HDR, ETH_P_ALL = 263, 15, 3
OUTGOING = 4
LONGEST = 1 << 17


def end_of(device: str) -> socket.socket:
    """All that goes through a device."""
    end = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETH_P_ALL))
    end.setsockopt(SOL_PACKET, PACKET_VNET_HDR, 1)
    end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 24)
    end.bind((device, ETH_P_ALL))
    return end


def main() -> None:
    """Carry packets both ways."""
    devices, (delay, loss) = sys.argv[1:3], map(float, sys.argv[3:5])
    ends = [end_of(device) for device in devices]
    others = dict(zip(ends, reversed(ends), strict=True))
    lost = random.Random(7)
    under_way: deque[tuple[float, socket.socket, bytes]] = deque()
    print("carries", flush=True)
    while True:
        wait = max(0.0, under_way[0][0] - time.monotonic()) if under_way else 1.0
        for end in select.select(ends, [], [], wait)[0]:
            packet, (_, _, kind, *_) = end.recvfrom(LONGEST)
            if kind != OUTGOING and lost.random() >= loss:
                under_way.append((time.monotonic() + delay, others[end], packet))
        while under_way and under_way[0][0] <= time.monotonic():
            _, end, packet = under_way.popleft()
            end.send(packet)


if __name__ == "__main__":
    main()
