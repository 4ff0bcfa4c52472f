"""Units and descriptions of duty points and order spectra, in units of machines."""

#: name -> (CF units, long_name)
DESCRIPTIONS = {
    # order spectra
    "mesh_order": ("1", "frequency over mesh frequency"),
    "force_amplitude": ("N", "peak amplitude of the mesh force at the order; at 0 the mean"),
    "force_phase": ("rad", "phase of the mesh force at the order"),
    "force_amplitude_error": ("N", "estimated error of the amplitude of the mesh force"),
    "error_amplitude": (
        "m",
        "peak amplitude of the transmission error at the order, at 0 mean",
    ),
    "error_phase": ("rad", "phase of the transmission error at the order"),
    "error_amplitude_error": ("m", "estimated error of the amplitude of the transmission error"),
    "mean_square_force": ("N2", "mean square of the mesh force, by samples"),
    "mean_square_error": ("m2", "mean square of the transmission error, by samples"),
    # duty point
    "mesh_frequency_hertz": ("Hz", "mesh frequency"),
    "resonance_speed": ("min-1", "speed at tuning 1"),
    "iso_dynamic_factor": ("1", "dynamic factor K_v of ISO 6336-1, method B"),
    "static_force": ("N", "static mesh force"),
    "mesh_force_max": ("N", "largest mesh force"),
    "mesh_force_min": ("N", "smallest mesh force, negative on the coast side"),
    "bearing": ("1", "gear that the bearings carry"),
    "bearing_force_max": ("N", "largest force of the bearings of a shaft together"),
    "error_peak_to_peak": ("m", "peak-to-peak dynamic transmission error"),
    "error_rms": ("m", "dynamic transmission error, root mean square about its mean"),
    "mesh_order_force": ("N", "peak amplitude of the mesh force"),
    "mesh_order_error": ("m", "peak amplitude of the dynamic transmission error"),
}
