"""Limits of the villages that roads of one carriageway lead through."""

from ..base.schema import ClosedModel
from ..road.things.limits import Interval, interval
from ..road.things.limits import share as probability


class VillageLimits(ClosedModel):
    """Villages that a road of one carriageway leads through."""

    share: float = probability(
        0.0, "Probability that a road of one carriageway leads through a village.", title="Village"
    )
    length: Interval = interval(
        150.0, 400.0, "m", "Length of the village; at most the road's without 25 m at its ends."
    )
    kerb_height: Interval = interval(0.10, 0.14, "m", "Height of kerbs.")
    footway_width: Interval = interval(1.8, 2.8, "m", "Width of the footways beside parking bays, or without any.")
    gutters: float = probability(0.6, "Probability of gutters of setts or concrete.", title="Gutters of Setts")
    parking: float = probability(0.5, "Probability that a side has parking bays.", title="Parking Bays")
    bay_width: Interval = interval(2.0, 2.3, "m", "Width of parking bays.")
    occupied: float = probability(0.6, "Share of the parking stands that a vehicle stands on.", title="Occupied Stands")
    plot_length: Interval = interval(14.0, 28.0, "m", "Length of a plot along the road: a drive and a house.")
    house_distance: Interval = interval(0.5, 6.0, "m", "Distance of houses from the verge behind the footway.")
    crossing: float = probability(0.5, "Probability of a zebra crossing.", title="Zebra Crossing")
    bus_stop: float = probability(0.4, "Probability of a bus stop on either side.", title="Bus Stop")
    trenches: float = probability(
        0.0, "Probability of a service trench along a lane, with some to drives.", title="Service Trenches"
    )
    slow: float = probability(0.0, "Probability of signs for a speed limit of 30 km/h.", title="Speed Limit 30")
    islands: float = probability(
        0.0, "Probability of a traffic island at either end, where there is room.", title="Entrance Islands"
    )
    one_sided_islands: float = probability(
        0.5, "Probability that an island moves only the lane that leads in, else both by half.", title="One-Sided"
    )
    island_width: Interval = interval(1.6, 2.5, "m", "Width of the islands.")
    island_length: Interval = interval(6.0, 12.0, "m", "Length of the islands.")
    island_taper: Interval = interval(6.0, 10.0, "1", "Length over which a lane moves by one metre beside an island.")
    shelters: float = probability(0.0, "Probability that a bus stop has a shelter.", title="Bus Shelters")
    light_spacing: Interval = interval(25.0, 40.0, "m", "Spacing of the street lights.")
    light_height: Interval = interval(5.0, 8.0, "m", "Height of the street lights.")
