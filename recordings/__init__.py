"""What a robot recorded: MCAP files, the incidents of its stops, and the judgement of any robot's recording."""
