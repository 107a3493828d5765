"""What the paper prints, as data: nothing here is computed.

D. Pietruszczak, "Laboratory investigations of dynamic properties of accelerometers with fractional
orders for application in telematic equipment".
"""

# Section 2.
SAMPLING_RATE_HZ = 10_000.0
IDENTIFIED_AT_HZ = 300.0
SENSITIVITY_EXAMINED_MV = 10.18   # B&K 4507, mV per m/s²
SENSITIVITY_REFERENCE_MV = 317.0  # KB 12
# Equation (6), descending powers of z.
G_NUMERATOR = (0.79196, 0.51435, 0.0)
G_DENOMINATOR = (1.0, -0.6439, 0.048034)

# Tables 1 to 3.
FREQUENCY_HZ = (100.0, 200.0, 300.0, 400.0, 500.0)
TABLE_1_SENSOR_PERCENT = (45.2213, 22.9227, 29.1945, 70.6078, 90.5626)
TABLE_1_MODEL_PERCENT = (30.8089, 30.2997, 29.5564, 28.3097, 26.0184)
TABLE_2_FRACTIONAL_PERCENT = (20.8040, 20.8041, 20.8042, 20.8039, 20.8040)
TABLE_2_DIFFERENCE_PERCENT = (10.0049, 9.4956, 8.7522, 7.5058, 5.2144)
TABLE_3_FRACTIONAL_PERCENT = (20.8040, 20.8041, 20.8042, 20.8039, 20.8040)
TABLE_3_DIFFERENCE_PERCENT = (24.4173, 2.1186, 8.3903, 49.8039, 69.7586)
# Table 4.
TABLE_4_V1 = (0.94, 0.96, 0.98, 1.0, 1.02, 1.04, 1.06, 1.08)
TABLE_4_V2 = (1.94, 1.96, 1.98, 2.0, 2.02, 2.04, 2.06, 2.08)

# Section 3: by how much the model's error is larger than the sensor's at 300 Hz.
MODEL_OVER_SENSOR_PERCENT = 0.3619
# Section 4: orders that were tried, and what is said of the magnitude and phase above 1 Hz.
ORDERS_FIRST, ORDERS_LAST, ORDERS_STEP = 0.94, 2.08, 0.02
CLOSEST_ORDER = 1.0
FLAT_ABOVE_HZ = 1.0
MAGNITUDE_DB = (-2.03, -2.02)
PHASE_DEG = (1e-6, 0.04)
DECREASE_PERCENT = (5.2144, 10.0049)
# Section 5: frequency [Hz], magnitude [dB] and phase [deg] that are told of Figures 16 and 17.
FIGURE_16 = {"flat_from_hz": 0.5, "magnitude_db": -2.02, "largest_phase_deg": 0.05,
             "phase_at_1_hz_deg": 0.005}

# Not in the paper, but in the data sheet of the B&K 4507: its mounted resonance.
RESONANCE_4507_HZ = 18_000.0
