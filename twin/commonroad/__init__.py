"""CommonRoad's multi-body car: another simulator in the twin's place."""
