"""The faces in which a span lies, where they are several: a list, and from `FEW` on a hash table to find them in.

So entering and leaving a face takes a few steps, however many there are. The table has open addresses and linear
probes; what is erased leaves no trace (D. E. Knuth, *The Art of Computer Programming*, volume 3, section 6.4,
algorithms L and R). Each band has a part of both tables to itself, as large as its part of the edge table, and twice
that.
"""

from tasuki.language import i32, module, record
from tasuki.modules.scanline.records import FaceSlot, Layer, face_slots, layers

NOWHERE = -1
FEW = 8
SPREAD = -1640531527
"""2**32 divided by the golden ratio, as an i32: multiples of it spread."""


@record
class Room:
    """A band's part of the tables: layers from `first` on; `slots` of the hash table from 2 * `first` on."""

    first: i32
    slots: i32


@module
def home(face: i32, room: Room) -> i32:
    """Where in its part of the hash table a face stands if nothing is in its way."""
    return (face * SPREAD & 0x7FFFFFFF) % room.slots


@module
def behind(slot: i32, room: Room) -> i32:
    """The slot behind another; the first behind the last."""
    return slot + 1 if slot + 1 < room.slots else 0


@module
def find_slot(face: i32, room: Room) -> i32:
    """The slot of a face, or the empty one where it would be entered, counted from the part's first."""
    slot = home(face, room)
    found = face_slots[2 * room.first + slot].face
    while found != 0 and found != face + 1:
        slot = behind(slot, room)
        found = face_slots[2 * room.first + slot].face
    return slot


@module
def erase(slot: i32, room: Room):
    """Empty a slot, and move up what stands behind it only because the slot was taken."""
    base = 2 * room.first
    gap = slot
    probe = behind(gap, room)
    while face_slots[base + probe].face != 0:
        moved = face_slots[base + probe]
        if (probe - home(moved.face - 1, room)) % room.slots >= (probe - gap) % room.slots:
            face_slots[base + gap] = moved
            gap = probe
        probe = behind(probe, room)
    face_slots[base + gap].face = 0


@module
def enter_slot(place: i32, room: Room):
    """Enter a layer into the hash table, or its new place, if it is there."""
    face = layers[place].face
    face_slots[2 * room.first + find_slot(face, room)] = FaceSlot(face + 1, place)


@module
def find_layer(face: i32, end: i32, room: Room) -> i32:
    """The place of a face in the list that ends at `end`, or NOWHERE."""
    if end - room.first > FEW:
        slot = face_slots[2 * room.first + find_slot(face, room)]
        return slot.place if slot.face != 0 else NOWHERE
    for place in range(room.first, end):
        if layers[place].face == face:
            return place
    return NOWHERE


@module
def enter_layer(layer: Layer, end: i32, room: Room):
    """Append a layer to the list that ends at `end`."""
    layers[end] = layer
    if end - room.first == FEW:
        for place in range(room.first, end):
            enter_slot(place, room)
    if end - room.first >= FEW:
        enter_slot(end, room)


@module
def leave_layer(place: i32, end: i32, room: Room):
    """Take the layer at `place` out of the list that ends at `end`. The last one takes its place."""
    left = layers[place].face
    layers[place] = layers[end - 1]
    if end - room.first > FEW:
        enter_slot(place, room)
        erase(find_slot(left, room), room)
    if end - 1 - room.first == FEW:
        forget(end - 1, room)


@module
def forget(end: i32, room: Room):
    """Take all layers of the list that ends at `end` out of the hash table."""
    for place in range(room.first, end):
        erase(find_slot(layers[place].face, room), room)


@module
def end_layers(end: i32, room: Room):
    """The row ends, and with it the list, which ends at `end`."""
    if end - room.first > FEW:
        forget(end, room)
